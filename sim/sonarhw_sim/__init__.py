"""The prediction: room model, air, transducer, ray following, receivers."""
