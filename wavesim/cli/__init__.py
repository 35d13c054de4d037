"""The commands; nothing else imports them."""
