"""The results of a test for readers and programs: certificate, tables, figures."""
