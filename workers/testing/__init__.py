"""The contract that every executor must pass: subclass `contract.ExecutorContract` in a test module."""
