"""Plans in the formats that people have -> Plan."""
