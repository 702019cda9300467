"""The engine: from an expression to the best parameters per target, fast. Start with the README beside this."""
