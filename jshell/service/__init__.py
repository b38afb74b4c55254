"""Fits as a service: jobs in a database, workers that do them, a page and an API in front."""
