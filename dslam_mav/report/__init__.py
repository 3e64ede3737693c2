"""What a person reads after a flight: a self-contained HTML page, a table for the terminal, a JSON object."""
