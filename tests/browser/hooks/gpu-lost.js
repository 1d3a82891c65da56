// The GPU worker on a device that is taken away when the page says so.
import "./gpu-lose.js";
import "../extraction/gpu-worker.js";
