"""Which vehicle: ranking, requirements, reasons of refusal."""
