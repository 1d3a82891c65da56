const request = GPUAdapter.prototype.requestDevice;
GPUAdapter.prototype.requestDevice = async function (...args) {
  const device = await request.apply(this, args);
  new BroadcastChannel("gpu").onmessage = () => device.destroy();
  return device;
};
