package colonnade.ray

import chisel3._
import chisel3.util.Decoupled
import colonnade.common.TimingSlice
import colonnade.config.PathConfig
import colonnade.formats.Bounds

final class RayEntryIO(config: PathConfig) extends Bundle {
  val ray       = Flipped(Decoupled(new PermutedRay(config)))
  val quotients = Flipped(Decoupled(new SlopeQuotients(config)))
  val bounds    = Input(new Bounds(config.numbers))
  val output    = Decoupled(new PreparedRay(config))
  val busy      = Output(Bool())
}

/** Computes the distance at which a ray enters the object's box, and advances the ray's origin by it.
  *
  * A ray may come before its quotients, which must stay valid until they are accepted. If they are in time, the latency
  * is 10 + 2 · slices cycles (14 with a shear factor of two multiplier slices), or 12 for a ray that misses the
  * box; with `units.extraSlices` three more. The next ray is accepted in the cycle in which the result is taken. Source:
  * docs/numbers.md, sections 2.3 to 2.8.
  */
final class RayEntry(config: PathConfig) extends Module {
  val io = IO(new RayEntryIO(config))

  private val control  = Module(new EntryControl(EntryDatapath.slices(config), TimingSlice.extra(config.device)))
  private val datapath = Module(new EntryDatapath(config))

  control.io.rayValid       := io.ray.valid
  io.ray.ready              := control.io.rayReady
  control.io.quotientsValid := io.quotients.valid
  io.quotients.ready        := control.io.quotientsReady
  io.output.valid           := control.io.outputValid
  control.io.outputReady    := io.output.ready
  control.io.enters         := datapath.io.enters
  io.busy                   := control.io.busy

  datapath.io.command   := control.io.command
  datapath.io.ray       := io.ray.bits
  datapath.io.quotients := io.quotients.bits
  datapath.io.bounds    := io.bounds
  io.output.bits        := datapath.io.output
}
