"""The page: rendered here, without a build step, useful without JavaScript."""
