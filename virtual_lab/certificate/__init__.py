"""What a person or another program reads: certificate, tables, figures."""
