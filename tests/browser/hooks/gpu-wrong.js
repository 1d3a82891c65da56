// The GPU worker on a device whose kernels do not run, as those of a shader that was refused: what
// their outputs held stays.
import "./gpu-refuse.js";
import "../extraction/gpu-worker.js";
