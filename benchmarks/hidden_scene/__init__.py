"""A bench whose scene has one number wrong, or none, and which a diagnosis never sees."""
