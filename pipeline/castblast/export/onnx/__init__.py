"""The network as an ONNX model."""
