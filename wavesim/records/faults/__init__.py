"""What is wrong with a record, a kind of fault a file: in each channel, and in all together."""
