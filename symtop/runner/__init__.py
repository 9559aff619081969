"""Studies: a question, a grid of cases, figures and a verdict; and the one runner for all of them."""
