"""What a table is, what it needs, how it is printed, drawn, cached and put into the report."""
