"""Normal equations of models against rows written out, and what rows of one pose share."""
