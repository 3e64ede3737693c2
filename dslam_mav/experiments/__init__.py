"""The paper's experiments (Section V): pure computation, from scenes to figures, tables and pictures."""
