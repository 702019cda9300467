"""The backends: what runs or prints the lowered form of an expression. Start with the README beside this."""
