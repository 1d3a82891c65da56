GPUComputePassEncoder.prototype.dispatchWorkgroups = function () {};
GPUComputePassEncoder.prototype.dispatchWorkgroupsIndirect = function () {};
