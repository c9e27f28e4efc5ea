"""Light transport: noise, cost, how bright rooms are."""
