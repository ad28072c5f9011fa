"""From blobs to flights: pieces of constant acceleration, joint fit, scale, contacts, doubts."""
