"""The commands; nothing else imports them. Ctrl-C and SIGTERM are heeded from the first moment."""

from wavesim.cli import interrupts as interrupts
