"""Runs: how they are configured, evaluated, trained, and what they leave."""
