"""Where agents end: of one graph exactly or in intervals, of families for every signal."""
