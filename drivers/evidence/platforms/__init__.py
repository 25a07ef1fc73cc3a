"""The quick pages of evidence on several releases of the libraries."""
