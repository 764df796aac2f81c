"""The ground study: one pose set selected, measured, identified and judged."""
