"""Certify a leg controller, in any language, against the answers in `conformance/`."""
