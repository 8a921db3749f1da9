package colonnade.ray

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Mux1H, RegEnable}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Camera
import colonnade.numbers.{CarrySave, Fixed, Rounding}

/** A pixel, and the context of its primary ray. */
final class RayPosition(config: PathConfig) extends Bundle {
  val context = Context(config)
  val x       = UInt(config.numbers.coordinateBits.W)
  val y       = UInt(config.numbers.coordinateBits.W)

  /** [[colonnade.formats.UnitPosition]]'s. */
  val meetsObject  = if (config.device.hasEnvironment) Some(Bool()) else None
  val inObjectTile = if (config.device.hasEnvironment) Some(Bool()) else None
}

/** The frame registers that define a primary ray. */
final class CameraRegisters(config: PathConfig) extends Bundle {
  val camera = new Camera(config.numbers)

  /** Left shift of a camera position to grid steps. */
  val unitShift = UInt(NumberFormats.bitLength(config.numbers.sceneBits).W)
}

final class RayGeneratorIO(config: PathConfig) extends Bundle {
  val registers = Input(new CameraRegisters(config))
  val position  = Flipped(Decoupled(new RayPosition(config)))
  val ray       = Decoupled(new RayRequest(config))
  val pixel     = Output(new RayPosition(config)) // the pixel of the offered ray
}

/** Generates primary rays: `dir = (camera.dir << stepShift) + x · stepX + y · stepY`, exact, from `position <<
  * unitShift`.
  *
  * Throughput: a ray per cycle while each pixel follows the one before it in the Morton order of its tile, and a cycle
  * more for each pixel that is left out; pixels of two tiles may be mixed, `inObjectTile` tells them apart. Another
  * pixel takes `coordinateBits` + 1 cycles, which is the most. Any order gives the same rays. Latency: 2 cycles, later
  * by the cycles of such sums, and if another ray waits before it. The registers may change when the unit has been
  * empty for [[RayGenerator.emptyCycles]] cycles. Source: docs/traversal.md.
  */
final class RayGenerator(config: PathConfig) extends Module {
  val io = IO(new RayGeneratorIO(config))

  private val numbers = config.numbers
  private val scene   = new RayFormats(numbers).scene
  private val levels  = log2Ceil(config.device.frame.tileSize)

  // Control: a pixel waits in front for its direction; the back offers its ray
  private val inFront  = RegInit(false.B)
  private val inBack   = RegInit(false.B)
  private val empty    = RegInit(RayGenerator.emptyCycles.U)
  private val isNew    = empty === RayGenerator.emptyCycles.U
  private val position = RegEnable(io.position.bits, io.position.fire)

  // The tiles' last pixels, and whether a pixel comes after the other tile's
  private val accepts  = io.position.fire
  private val changes  = !isNew && tileOf(io.position.bits) =/= tileOf(position)
  private val isChange = RegEnable(changes, accepts)
  private val other    = RegEnable(position, accepts && changes)
  private val hasOther = Reg(Bool())
  when(accepts) { hasOther := !isNew && (hasOther || changes) }
  private val isKnown = !isNew && (!changes || hasOther)
  private val before  = Mux(changes, other, position)
  private val topBit  = numbers.coordinateBits
  private val follows = RegEnable(isKnown && isLater(before, io.position.bits), accepts)
  private val bit     = RegInit(topBit.U)
  private val sums    = inFront && (!inBack || io.ray.ready)
  private val isFirst = RegEnable(accepts, accepts || sums)

  // A pixel that follows: the sum goes through the codes up to its own
  private val code  = Reg(UInt((2 * levels).W))
  private val moves = sums && Mux(follows, code === tileCode(position), bit === 0.U)
  when(accepts) { code := tileCode(before) + 1.U }.elsewhen(sums) { code := code + 1.U }

  io.ray.valid      := inBack
  io.position.ready := !inFront || moves
  inFront           := io.position.valid || (inFront && !moves)
  inBack            := moves || (inBack && !io.ray.ready)
  when(sums && !follows) { bit := Mux(bit === 0.U, topBit.U, bit - 1.U) }
  when(inFront || inBack) { empty := 0.U }.elsewhen(!isNew) { empty := empty + 1.U }

  // What is added, by the table in docs/traversal.md: the next code sets the lowest clear bit of the one before. For
  // another pixel, the sum goes through the bits of x and y from the top, and takes in the camera's direction at bit
  // stepShift, so that needs no shifter.
  private val sets     = (0 until 2 * levels).map(n => follows && code(n, 0) === (BigInt(1) << n).U)
  private val clears   = sets.tail.reduce(_ || _)
  private val addsX    = follows || bitOf(position.x)
  private val addsY    = Mux(follows, clears, bitOf(position.y))
  private val addsDir  = !follows && bit === io.registers.camera.stepShift
  private val isDouble = !follows && !isFirst

  // Datapath: the camera registers are constant, so their terms have no registers of their own
  private val pixel = RegEnable(position, moves)
  io.pixel             := pixel
  io.ray.bits.context  := pixel.context
  io.ray.bits.isShadow := false.B
  io.ray.bits.leadsThroughWorld()
  (0 until 3).foreach { axis =>
    io.ray.bits.origin.axes(axis) := Fixed(scene, origin(axis))
    io.ray.bits.dir.axes(axis)    := direction(axis)
  }

  /** The shift has as many bits as its legal values: `RegisterLimits`. */
  private def origin(axis: Int): SInt = {
    val shiftBits = NumberFormats.bitLength(numbers.maxUnitShift)
    val shift     = if (shiftBits == 0) 0.U(0.W) else io.registers.unitShift(shiftBits - 1, 0)
    shiftLeft(io.registers.camera.position.axes(axis), shift, scene.width)
  }

  /** A value shifted left, in `width` bits; the bits above are lost. */
  private def shiftLeft(value: SInt, by: UInt, width: Int): SInt = {
    val wide = Rounding.narrow(value.pad(width), width)
    (0 until by.getWidth).foldLeft(wide) { (shifted, bit) =>
      Mux(by(bit), Rounding.narrow((shifted << (1 << bit)).asSInt, width), shifted)
    }
  }

  private def direction(axis: Int): SInt = {
    val bits   = numbers.directionBits
    val camera = io.registers.camera
    val terms  = Seq(camera.stepX, camera.stepY, camera.dir).map(_.axes(axis).pad(bits).asUInt)
    val sum    = Reg(UInt(bits.W))

    def shifted(term: UInt, by: Int): UInt = (term << by)(bits - 1, 0)
    val subtracted = sets.indices.tail.map(n => sets(n) -> ~shifted(terms((n + 1) % 2), (n + 1) / 2))
    val third      = Mux1H((addsDir -> terms(2)) +: subtracted)
    // The direction before: the last one, or the other tile's, which is kept when the tile changes
    val returns = isChange && isFirst
    val ofOther = RegEnable(sum, sums && returns)
    val start   =
      Mux1H(Seq((follows && !returns) -> sum, (follows && returns) -> ofOther, isDouble -> shifted(sum, 1)))

    val (steps, stepCarries) = CarrySave(Mux(addsX, terms(0), 0.U), Mux(addsY, terms(1), 0.U), third, clears)
    val (whole, carries)     = CarrySave(start, steps, stepCarries)
    when(sums) { sum := whole + carries }
    sum.asSInt
  }

  /** The bit of a coordinate that is added; the highest step has none. */
  private def bitOf(coordinate: UInt): Bool = (0.U(1.W) ## coordinate)(bit)

  /** Which of two tiles a pixel belongs to. */
  private def tileOf(pixel: RayPosition): Bool = pixel.inObjectTile.getOrElse(true.B)

  /** Whether a pixel comes after another one in a tile, and its sum is no longer than bit by bit. */
  private def isLater(before: RayPosition, pixel: RayPosition): Bool = {
    def tile(pixel: RayPosition): UInt = (pixel.y >> levels) ## (pixel.x >> levels)
    val codes                          = tileCode(pixel) -& tileCode(before)
    tile(pixel) === tile(before) && !codes.head(1).asBool && codes.tail(1).orR && codes.tail(1) <= (topBit + 1).U
  }

  /** The Morton code of a pixel in its tile. */
  private def tileCode(pixel: RayPosition): UInt =
    Cat((0 until levels).reverse.flatMap(level => Seq(pixel.y, pixel.x).map(_.pad(levels)(level))))
}

object RayGenerator {

  /** Cycles without a pixel before the registers may change. A primary ray takes longer to become a pixel. */
  val emptyCycles = 8
}
