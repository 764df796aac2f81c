"""Evidence of models about one fit: their normal equations, with springs and shared misfit."""
