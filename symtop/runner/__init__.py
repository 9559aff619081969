"""The runner of studies. A study is a question with a grid of cases, facts, tables and figures."""
