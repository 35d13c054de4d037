"""The paper reproduced: figures, claims, findings."""
