"""The API: routes only, by noun."""
