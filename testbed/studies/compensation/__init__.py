"""The loop closed: commanded poses corrected and measured again."""
