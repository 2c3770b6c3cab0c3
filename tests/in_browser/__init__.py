"""What a browser shows; a package, so that its tests share one browser."""
