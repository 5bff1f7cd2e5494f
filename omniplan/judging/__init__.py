"""Every limit between the samples: enclosures, judges, halving until decided."""
