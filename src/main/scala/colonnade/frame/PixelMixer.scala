package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{LeavingPixels, PixelPosition, UnitPosition}

final class PixelMixerIO(config: ColonnadeConfig) extends Bundle {

  /** Pixels of a tile that may show the object, and of one that shows the environment only. */
  val objects     = Flipped(Decoupled(new UnitPosition(config)))
  val environment = Flipped(Decoupled(new PixelPosition(config)))
  val positions   = Decoupled(new UnitPosition(config))

  val leaving    = Input(new LeavingPixels) // from the column
  val marchWaits = Input(Bool())            // a ray waits for a march
}

/** Mixes the pixels of two tiles: those of the environment use units that those of the object leave idle, and the other
  * way round. Where marches are what the pixels wait for, a column takes few pixels of the object ahead, so that columns
  * end together. Combinational, one pixel per cycle.
  *
  * @param maxEnvironment pixels of the environment go first while fewer of them are in flight, and wait otherwise
  * @param maxMarching    as many pixels of the object may be in flight in [[PixelMixer.memory]] cycles after a wait for a
  *                       march
  */
final class PixelMixer(config: ColonnadeConfig, maxEnvironment: Int, maxMarching: Int) extends Module {
  val io = IO(new PixelMixerIO(config))

  private val inFlight = RegInit(0.U(log2Ceil(maxEnvironment + 1).W))
  inFlight := inFlight + io.environment.fire - io.leaving.ofEnvironment
  private val isEnvironment = io.environment.valid && inFlight =/= maxEnvironment.U

  private val objects = RegInit(0.U(log2Ceil(config.units.pathContexts + 3).W)) // in flight, and chosen
  private val waited  = RegInit(0.U(log2Ceil(PixelMixer.memory + 1).W))
  objects := objects + io.objects.fire - io.leaving.ofObject
  when(io.marchWaits)(waited := PixelMixer.memory.U).elsewhen(waited =/= 0.U)(waited := waited - 1.U)
  private val isObject = io.objects.valid && !isEnvironment && (waited === 0.U || objects < maxMarching.U)

  io.objects.ready     := io.positions.ready && isObject
  io.environment.ready := io.positions.ready && isEnvironment

  io.positions.valid := isObject || isEnvironment
  io.positions.bits  := io.objects.bits
  when(isEnvironment) {
    io.positions.bits.x               := io.environment.bits.x
    io.positions.bits.y               := io.environment.bits.y
    io.positions.bits.meetsObject.get := false.B
  }
  io.positions.bits.inObjectTile.get := !isEnvironment
}

object PixelMixer {
  val memory: Int = 31 // cycles: longer than the marches take to accept the next ray that waits
}
