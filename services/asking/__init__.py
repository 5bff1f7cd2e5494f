"""How clients ask."""
