"""Small archives as the field's own software writes them: one module for each family of formats."""
