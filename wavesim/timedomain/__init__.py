"""The time-domain side: grid operator, steppers, integration."""
