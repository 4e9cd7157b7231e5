"""Characters that live: sessions, their owner, their store, their stream."""
