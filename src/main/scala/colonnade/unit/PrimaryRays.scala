package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.formats.{PixelPosition, UnitPosition}
import colonnade.ray.{CameraRegisters, RayGenerator, RayRequest}

/** A context that gets a pixel. */
final class AllocatedPixel(config: PathConfig) extends Bundle {
  val context = Context(config)
  val pixel   = new UnitPosition(config.device)
}

final class PrimaryRaysIO(config: PathConfig) extends Bundle {
  val camera    = Input(new CameraRegisters(config))
  val positions = Flipped(Decoupled(new UnitPosition(config.device)))

  val control = new AllocationControl(config)

  /** A context that gets a pixel: for the stages that reset its path, and with its pixel. */
  val start     = Valid(Context(config))
  val allocated = Valid(new AllocatedPixel(config))
  val ray       = Decoupled(new RayRequest(config))

  /** The pixel of `ray`, and whether the ray may hit the object. */
  val pixel       = Output(new PixelPosition(config.device))
  val meetsObject = Output(Bool())
}

/** Allocates an idle context to each pixel position, and generates its primary ray. Throughput: `RayGenerator`'s,
  * while contexts are idle.
  */
final class PrimaryRays(config: PathConfig) extends Module {
  val io = IO(new PrimaryRaysIO(config))

  private val generator = Module(new RayGenerator(config))
  private val position  = io.positions.bits
  private val free      = io.control.free
  generator.io.registers             := io.camera
  generator.io.position.valid        := io.positions.valid && free.valid
  generator.io.position.bits.context := free.bits
  generator.io.position.bits.x       := position.x
  generator.io.position.bits.y       := position.y
  generator.io.position.bits.meetsObject.zip(position.meetsObject).foreach { case (to, from) => to := from }
  generator.io.position.bits.inObjectTile.zip(position.inObjectTile).foreach { case (to, from) => to := from }
  io.positions.ready := generator.io.position.ready && free.valid

  io.control.allocate       := generator.io.position.fire
  io.start.valid            := generator.io.position.fire
  io.start.bits             := free.bits
  io.allocated.valid        := generator.io.position.fire
  io.allocated.bits.context := free.bits
  io.allocated.bits.pixel   := position

  io.ray :<>= generator.io.ray
  io.pixel.x     := generator.io.pixel.x
  io.pixel.y     := generator.io.pixel.y
  io.meetsObject := generator.io.pixel.meetsObject.getOrElse(true.B)
}
