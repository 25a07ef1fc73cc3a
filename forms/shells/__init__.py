"""Variational forms of membrane and shell."""
