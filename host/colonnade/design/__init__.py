"""Designs: configurations, the generator that makes Verilog of them, and its manifest."""
