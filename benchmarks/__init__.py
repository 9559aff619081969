"""What a step costs beside the same step in C, and what a run costs beside other libraries."""
