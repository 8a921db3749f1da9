package colonnade.ray

import chisel3._
import chisel3.util.{Counter, Decoupled, RegEnable}
import colonnade.common.Context
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{Camera, Vec3}
import colonnade.numbers.{Fixed, Rounding}

/** A pixel, and the context of its primary ray. */
final class RayPosition(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val x       = UInt(config.numbers.coordinateBits.W)
  val y       = UInt(config.numbers.coordinateBits.W)

  /** [[colonnade.formats.UnitPosition]]'s. */
  val meetsObject  = if (config.hasEnvironment) Some(Bool()) else None
  val inObjectTile = if (config.hasEnvironment) Some(Bool()) else None
}

/** The frame registers that define a primary ray. */
final class CameraRegisters(config: ColonnadeConfig) extends Bundle {
  val camera = new Camera(config.numbers)

  /** Left shift of a camera position to grid steps. */
  val unitShift = UInt(NumberFormats.bitLength(config.numbers.sceneBits).W)
}

final class RayGeneratorIO(config: ColonnadeConfig) extends Bundle {
  val registers = Input(new CameraRegisters(config))
  val position  = Flipped(Decoupled(new RayPosition(config)))
  val ray       = Decoupled(new RayRequest(config))

  /** The pixel of the offered ray. */
  val pixel = Output(new RayPosition(config))
}

/** Ray generation: [[RayGenerator]], or with `units.pipelined` a [[RayGeneratorPipeline]]. */
abstract class RayGeneratorModule(config: ColonnadeConfig) extends Module {
  final val io = IO(new RayGeneratorIO(config))
}

/** Generates primary rays: `dir = (camera.dir << stepShift) + x · stepX + y · stepY`, exact, from `position << unitShift`.
  *
  * One multiplier computes the six products in sequence. Latency: a ray is offered 8 cycles after its pixel was accepted,
  * and the next pixel is accepted in the cycle that takes the ray. The registers are constant while a pixel is in the
  * unit. A position outside the scene wraps around; the host rejects it. Source: docs/numbers.md, section 1.
  */
final class RayGenerator(config: ColonnadeConfig) extends RayGeneratorModule(config) {
  private val numbers = config.numbers
  private val scene   = new RayFormats(numbers).scene

  // Control: six products; each sum follows one cycle later
  private val products   = 2 * 3
  private val occupied   = RegInit(false.B)
  private val multiplies = RegInit(false.B)
  private val product    = Counter(products)
  private val adds       = RegNext(multiplies, false.B)
  private val ofY        = product.value(0)
  private val addsOfY    = RegNext(ofY)

  io.ray.valid      := occupied && !multiplies && !adds
  io.position.ready := !occupied || io.ray.fire
  when(multiplies) {
    when(product.inc()) { multiplies := false.B }
  }
  when(io.ray.fire) { occupied := false.B }
  when(io.position.fire) {
    occupied   := true.B
    multiplies := true.B
  }

  // Datapath: the components in order, for each the x product, then the y product
  private val position = RegEnable(io.position.bits, io.position.fire)
  private val camera   = io.registers.camera

  private def component[T <: Data](vector: Vec3[T]): T = {
    val axis = product.value >> 1
    Mux(axis === 0.U, vector.x, Mux(axis === 1.U, vector.y, vector.z))
  }

  private val step       = Mux(ofY, component(camera.stepY), component(camera.stepX))
  private val coordinate = Mux(ofY, position.y, position.x)
  private val base       = Mux(ofY, component(camera.position), component(camera.dir))
  private val amount     = Mux(ofY, io.registers.unitShift, camera.stepShift)
  private val term       = Reg(SInt((numbers.macBits + numbers.coordinateBits + 1).W))
  private val shifted    = Reg(SInt(numbers.directionBits.W))

  term    := step * coordinate.zext
  shifted := RayGenerator.shiftLeft(base, amount, numbers.directionBits)

  private val origin = Reg(Vec(3, SInt(scene.width.W)))
  private val dir    = Reg(Vec(3, SInt(numbers.directionBits.W)))

  // The sums cannot overflow: directionBits holds all three terms.
  private val sum = Rounding.narrow(Mux(addsOfY, dir.last, shifted) +& term, numbers.directionBits)
  when(adds && !addsOfY) {
    dir.zip(dir.tail).foreach { case (to, from) => to := from }
  }
  when(adds) { dir.last := sum }
  when(adds && addsOfY) {
    origin.zip(origin.tail).foreach { case (to, from) => to := from }
    origin.last := Rounding.narrow(shifted, scene.width)
  }

  io.pixel             := position
  io.ray.bits.context  := position.context
  io.ray.bits.isShadow := false.B
  io.ray.bits.origin.axes.zip(origin).foreach { case (to, from) => to := Fixed(scene, from) }
  io.ray.bits.dir.axes.zip(dir).foreach { case (to, from) => to := from }

}

object RayGenerator {
  def apply(config: ColonnadeConfig): RayGeneratorModule =
    if (config.units.pipelined) new RayGeneratorPipeline(config) else new RayGenerator(config)

  /** A value shifted left, in `width` bits; the bits above are lost. */
  private[ray] def shiftLeft(value: SInt, by: UInt, width: Int): SInt = {
    val wide = Rounding.narrow(value.pad(width), width)
    (0 until by.getWidth).foldLeft(wide) { (shifted, bit) =>
      Mux(by(bit), Rounding.narrow((shifted << (1 << bit)).asSInt, width), shifted)
    }
  }
}
