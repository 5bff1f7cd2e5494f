"""Who may ask what: certificates, roles, zenoh's access control."""
