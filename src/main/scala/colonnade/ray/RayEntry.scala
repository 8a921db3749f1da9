package colonnade.ray

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.ColonnadeConfig
import colonnade.formats.Bounds

final class RayEntryIO(config: ColonnadeConfig) extends Bundle {
  val ray       = Flipped(Decoupled(new PermutedRay(config)))
  val quotients = Flipped(Decoupled(new SlopeQuotients(config)))
  val bounds    = Input(new Bounds(config.numbers))
  val output    = Decoupled(new SetUpRay(config))
  val busy      = Output(Bool())
}

/** Finds where a ray enters the object's box, and advances its origin to there.
  *
  * A ray may come before its quotients, which must stay offered until they are taken. With them in time the result is
  * offered 10 + 2 · slices cycles after the ray was taken (14 with a shear factor of two multiplier slices), 12 when it
  * misses the box; the next ray is taken in the cycle in which the last one leaves. Source: docs/numbers.md, sections 2.3 to 2.8.
  */
final class RayEntry(config: ColonnadeConfig) extends Module {
  val io = IO(new RayEntryIO(config))

  private val control  = Module(new EntryControl(EntryDatapath.slices(config)))
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
