package colonnade.ray

import chisel3._
import chisel3.util.{Cat, MuxLookup, RegEnable}
import colonnade.common.TimingSlice
import colonnade.config.PathConfig
import colonnade.formats.Bounds
import colonnade.numbers.{Fixed, Rounding}

/** Quotients of a direction's mantissas, x' then y'. */
final class SlopeQuotients(config: PathConfig) extends Bundle {
  val shear      = Vec(2, UInt((config.numbers.shearDigits + 1).W))
  val reciprocal = Vec(2, UInt((config.numbers.reciprocalDigits + 1).W))
}

final class EntryDatapathIO(config: PathConfig) extends Bundle {
  val command   = Input(new EntryCommand(EntryDatapath.slices(config)))
  val ray       = Input(new PermutedRay(config))
  val quotients = Input(new SlopeQuotients(config))
  val bounds    = Input(new Bounds(config.numbers))
  val enters    = Output(Bool())
  val output    = Output(new PreparedRay(config))
}

/** Arithmetic of [[RayEntry]]: one rounder, one adder for distances, one multiplier, one shifter and one adder for
  * positions. All axes share them. The multiplier's first operand is a distance or the entry distance; its second one
  * is a reciprocal or a slice of a shear factor.
  */
final class EntryDatapath(config: PathConfig) extends Module {
  private val numbers  = config.numbers
  private val formats  = new RayFormats(numbers)
  private val slices   = EntryDatapath.slices(config)
  private val fraction = numbers.gridFraction

  // A signed distance in units within the scene; the format of the entry has a spare bit for points outside the scene.
  private val distanceBits = numbers.entryBits + 1
  private val sliceBits    = formats.reciprocal.width

  val io              = IO(new EntryDatapathIO(config))
  private val command = io.command

  // The ray. The axes of the origin rotate; their order is z', x', y' before each pass
  private val ray        = RegEnable(io.ray.info, command.loads)
  private val origin     = Reg(Vec(3, SInt(numbers.sceneBits.W)))
  private val tMax       = Reg(UInt(io.ray.tMax.getWidth.W))
  private val shear      = Reg(Vec(2, SInt(numbers.gridBits.W)))
  private val reciprocal = Reg(Vec(2, UInt(sliceBits.W)))
  private val tNear      = Reg(UInt(numbers.entryBits.W))
  private val tFar       = Reg(SInt(distanceBits.W))
  private val tEntry     = if (fraction < 0) Cat(tNear >> -fraction, 0.U((-fraction).W)) else tNear
  private val isTiny     = ray.isTiny

  // Distances from the origin to padded planes, in units; the sum of plane, origin and pad stays below 2^entryBits
  private val unitOrigin =
    RegEnable(Rounding.narrow(Rounding.nearestEven(origin.head, fraction), distanceBits), command.roundsOrigin)
  private val planeAxis  = Mux(command.crossesSide, 1.U +& command.crossingSide, 0.U) +& ray.orientation.axis
  private val isNegative =
    Mux(command.crossesSide, onSide(ray.orientation.negative, command.crossingSide), ray.orientation.negative(2))
  private val box   = PreparedRay.box(numbers, io.bounds, ray.visit)
  private val plane =
    Mux(isNegative === command.crossesFar, onAxis(box.low.axes, planeAxis), onAxis(box.high.axes, planeAxis))
  private val boxPad   = (BigInt(1) << numbers.boxPadLog).U
  private val pad      = Mux(command.crossesSide, boxPad +& (tNear >> numbers.vertexBits), boxPad).zext
  private val forward  = Mux(isNegative, unitOrigin, plane.zext) -& Mux(isNegative, plane.zext, unitOrigin)
  private val widened  = Mux(command.crossesFar, forward +& pad, forward -& pad)
  private val distance = RegEnable(Rounding.narrow(widened, distanceBits), command.crosses)

  // Products: the low slices of a shear factor are unsigned; the low product bits are kept for rounding
  private val productBits  = distanceBits + sliceBits + 1
  private val product      = Reg(SInt(productBits.W))
  private val multiplicand = Mux(command.multipliesShear, tEntry.zext, distance)
  private val shearSlice   =
    MuxLookup(command.slice, sliceOf(slices - 1))((0 until slices - 1).map(i => i.U -> sliceOf(i)))
  private val multiplier = Mux(command.multipliesShear, shearSlice, onSide(reciprocal, command.multiplySide).zext)
  private val operand    = TimingSlice.extra(config.device)
  private val carries    = operand(operand(command.multipliesShear && command.slice =/= 0.U))
  // An entry times a slice is one bit shorter than productBits; the carried part, shorter by a slice, adds no bit.
  product := Rounding.narrow(
    operand(operand(multiplicand) * operand(multiplier)) +& Mux(carries, product >> sliceBits, 0.S),
    productBits
  )
  private val whole =
    if (slices == 1) product
    else {
      val low = Reg(UInt(((slices - 1) * sliceBits).W))
      when(carries) { low := Cat(product(sliceBits - 1, 0), low) >> sliceBits }
      Cat(product, low).asSInt
    }

  // Scale a shear factor to the dominant component's exponent, or a product to units. The distance to shift by is ready
  // one cycle early, for timing
  private val quotient =
    Cat(onSide(io.quotients.shear, command.shearSide), 0.U((numbers.shearFraction - numbers.shearDigits).W))
  private val exponentNext = onSide(ray.exponent, command.scaleSideNext)
  private val toUnits      =
    Mux(onSide(isTiny, command.scaleSideNext), 0.U, numbers.reciprocalFraction.U - exponentNext)
  private val scalesShear = RegNext(command.scalesShearNext)
  private val shiftRight  = RegNext(Mux(command.scalesShearNext, exponentNext, toUnits))
  private val scaled      = operand(Rounding.floor(Mux(scalesShear, quotient.zext, product), shiftRight))
  private val isRising    = !onSide(ray.orientation.negative, command.takenSide)
  // At most 2^shearFraction, which occurs on a diagonal: one bit shorter than the format with its sign.
  private val slope = Rounding.narrow(scaled, numbers.gridBits)

  // Entry and exit along the ray. All values below 0 are equivalent. The bits above are tested beside the sum, for
  // timing
  private val above    = (scaled >> (distanceBits - 1)).asUInt
  private val isLarge  = !above(above.getWidth - 1) && above.orR
  private val isSmall  = above(above.getWidth - 1) && !above.andR
  private val units    = Rounding.narrow(scaled, distanceBits) +& command.scalesFar.asUInt.zext
  private val isLonger = !units(distanceBits) && units(distanceBits - 1)
  private val highest  = ((BigInt(1) << (distanceBits - 1)) - 1).S(distanceBits.W)
  private val crossing = RegEnable(
    Mux(isLarge || (isLonger && !isSmall), highest, Mux(isSmall, -highest, Rounding.narrow(units, distanceBits))),
    command.scales
  )
  private val slack = crossing >> numbers.entrySlackShift
  private val bound =
    operand(Rounding.saturate(Mux(command.boundsFar, crossing +& slack, crossing -& slack), distanceBits))

  // Advance: the first axis moves, and comes in again as the last
  private val entrySteps = Rounding.floor(tEntry, -fraction)
  private val sideways   = operand(Rounding.nearestEven(whole, numbers.vertexBits + 1))
  private val along      = Mux(ray.orientation.negative(2), 0.S -& entrySteps.zext, entrySteps.zext)
  private val moved      = origin.head +& Mux(command.advancesAlong, along, sideways)
  private val half       = BigInt(1) << (numbers.vertexBits - 1 + fraction)
  private val inReach    = Rounding.saturate(moved, -half, 3 * half)

  when(command.loads) {
    origin.zip(Seq(2, 0, 1)).foreach { case (to, from) => to := io.ray.origin(from).integer }
    tMax := io.ray.tMax
  }
  when(command.rotatesOrigin || command.advancesAlong || command.advancesSide) {
    origin(0) := origin(1)
    origin(1) := origin(2)
    origin(2) := Mux(command.rotatesOrigin, origin(0), inReach)
  }
  when(command.takesAlongNear) {
    tNear := Mux(distance < 0.S, 0.U, Rounding.narrow(distance.asUInt, numbers.entryBits))
  }
  when(command.takesAlongFar) { tFar := distance }
  when(command.takesReciprocals) {
    reciprocal.zip(io.quotients.reciprocal).zip(isTiny).foreach { case ((to, from), tiny) =>
      val one = (BigInt(1) << numbers.reciprocalFraction).U(sliceBits.W)
      to := Mux(tiny, one, from << (numbers.reciprocalFraction - numbers.reciprocalDigits))
    }
  }
  when(command.takesShear) { shear(command.takenSide) := Mux(isRising, slope, 0.S -% slope) }
  when(command.limits && !command.limitsFar && bound > tNear.zext) {
    tNear := Rounding.narrow(bound.asUInt, numbers.entryBits)
  }
  when(command.limits && command.limitsFar && bound < tFar) { tFar := bound }
  when(command.advancesAlong) {
    val farthest = formats.grid.highest
    tMax := Rounding.saturate(tMax.zext -& entrySteps.zext, 0, farthest).asUInt
  }

  io.enters := tNear.zext <= tFar && !ray.isZero(2)
  private val output = io.output
  output.root.foreach(_ := DontCare)
  output.visit.zip(ray.visit).foreach { case (to, from) => to := from }
  output.context         := ray.context
  output.isShadow        := ray.isShadow
  output.enters          := io.enters
  output.ray.orientation := ray.orientation
  Seq(1, 2, 0).zipWithIndex.foreach { case (from, to) =>
    // Clamped above, so it fits the grid.
    output.ray.origin(to) := Fixed(formats.grid, Rounding.narrow(origin(from), numbers.gridBits))
  }
  (0 until 2).foreach { side =>
    output.ray.shear(side)      := Fixed(formats.shear, shear(side))
    output.ray.reciprocal(side) := Fixed(formats.reciprocal, reciprocal(side))
    output.ray.exponent(side)   := Mux(isTiny(side), numbers.reciprocalFraction.U, ray.exponent(side))
  }
  output.tEntry := Fixed(formats.entry, tEntry)
  output.tMax   := Fixed(formats.grid, Rounding.narrow(tMax.zext, numbers.gridBits))

  private def onSide[T <: Data](values: Seq[T], side: UInt): T = Mux(side.asBool, values(1), values(0))

  /** The component of an axis, where 3 and 4 stand for x and y. */
  private def onAxis(components: Seq[UInt], axis: UInt): UInt =
    MuxLookup(axis, components(2))(Seq(0, 1, 3, 4).map(index => index.U -> components(index % 3)))

  /** A slice of the current shear factor: low slices are unsigned, the highest one has the sign. */
  private def sliceOf(index: Int): SInt = {
    val factor = onSide(shear, command.multiplySide).pad(slices * sliceBits)
    if (index < slices - 1) factor((index + 1) * sliceBits - 1, index * sliceBits).zext
    else Rounding.narrow(Rounding.floor(factor, index * sliceBits), sliceBits + 1).pad(sliceBits + 1)
  }
}

object EntryDatapath {

  /** Number of products of an entry and a shear factor. */
  def slices(config: PathConfig): Int = {
    val formats = new RayFormats(config.numbers)
    (formats.shear.width + formats.reciprocal.width - 1) / formats.reciprocal.width
  }
}
