"""Solution methods: from the operators of a model to histories in time."""
