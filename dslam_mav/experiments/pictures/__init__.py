"""The pictures, each like the paper's figure, with both methods and the bound. The only imports of matplotlib."""
