"""The cost of a step compared with the same step in C, and of a run compared with other libraries."""
