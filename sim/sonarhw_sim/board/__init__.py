"""The ranging board: profile, transducer, gain, traces and receiver."""
