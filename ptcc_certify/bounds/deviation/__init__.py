"""How far agents are from where they end, over time, by what is proved of graphs and of families."""
