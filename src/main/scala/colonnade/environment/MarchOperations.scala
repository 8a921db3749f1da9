package colonnade.environment

import chisel3._
import colonnade.config.PathConfig
import colonnade.microcode.{Exit, Label, Microprogram, Operand, Repeat, StepEncoding}
import colonnade.numbers.Rounding

import scala.collection.mutable

/** The program of the march, the registers of its ray, and the operations that its steps have of the datapath. */
final class MarchOperations(config: PathConfig, datapath: MarchDatapathIO) {
  val formats = new MarchFormats(config.device)
  import formats._

  val program = new Microprogram[MarchLabel](StepEncoding.OneHot)

  // The ray
  val uvwOrigin:    Vec[SInt] = Reg(Vec(3, SInt(originBits.W))) // projected; then u and v from the map's centre
  val projectedDir: Vec[SInt] = Reg(Vec(3, SInt((f + 1).W)))    // the direction's projection

  /** The direction in (u, v, w). For the bounding planes, the direction's projection relative to the map's centre. */
  val uvwDir: Vec[SInt] = Reg(Vec(3, SInt(directionBits.W)))

  /** Of each vector, the largest exponent of a component. */
  val uvwOriginExponent:    UInt = Reg(UInt(exponentBits.W))
  val projectedDirExponent: UInt = Reg(UInt(exponentBits.W))
  val uvwDirExponent:       UInt = Reg(UInt(exponentBits.W))

  /** The origin's depth. */
  val depthMantissa: UInt = Reg(UInt(f.W))
  val depthExponent: UInt = Reg(UInt(exponentBits.W))

  // Temporaries
  val axis:      UInt      = Reg(UInt(2.W))
  val exponents: Vec[UInt] = Reg(Vec(3, UInt(exponentBits.W)))
  val mantissa:  UInt      = Reg(UInt(f.W))
  val numerator: UInt      = Reg(UInt(f.W))

  /** A shifted value for the next steps. */
  val scaled: SInt = Reg(SInt(scaledBits.W))

  // Outputs of the datapath
  val lastCombined: SInt = datapath.lastCombined
  val product:      SInt = datapath.product
  val sum:          SInt = datapath.sum
  val sumExponent:  UInt = datapath.sumExponent
  val exponent:     UInt = datapath.exponent
  val shifted:      SInt = datapath.shifted
  val coordinate:   SInt = datapath.coordinate
  val along:        UInt = datapath.along
  val distance:     UInt = datapath.distance

  /** The divider's quotient, from [[awaitDivision]] on until [[takeQuotient]]. */
  val quotient:    UInt = datapath.quotient.bits
  val hasQuotient: Bool = datapath.quotient.valid

  val scaledProduct: SInt = Rounding.floor(product, f) // the product without its fraction bits
  val sumMantissa: UInt = shifted.asUInt(f - 1, 0) // the shifted sum, whose exponent was measured in the step before

  private val wideFactor       = new Operand(program, wideBits)
  private val narrowFactor     = new Operand(program, narrowBits)
  private val base, addend     = new Operand(program, sumBits)
  private val first, second    = new Operand(program, combineBits)
  private val subtracts        = new Operand(program, 1)
  private val combineSubtracts = new Operand(program, 1)
  private val division         = Seq.fill(2)(new Operand(program, f + 1))

  datapath.latchExponent := false.B
  datapath.takeQuotient  := false.B
  datapath.shift.valid   := false.B
  datapath.shift.bits    := DontCare

  def multiply(wide: SInt, narrow: SInt): Unit = {
    wideFactor.choose(wide)
    narrowFactor.choose(narrow)
  }

  /** Adds the product to the sum, or subtracts it. */
  def accumulate(subtract: Boolean = false): Unit = add(sum, product, subtract)

  /** Adds the product to the sum, or subtracts it if the condition holds. */
  def accumulate(subtracted: Bool): Unit = {
    add(sum, product)
    subtracts.choose(subtracted.asSInt)
  }

  /** Shifts the sum up and adds the product. */
  def shiftAccumulate(by: Int): Unit = add(shiftedUp.getOrElseUpdate(by, (sum << by).asSInt), product)

  private val shiftedUp = mutable.Map.empty[Int, SInt] // one operand for all steps of a shift

  /** Puts a value into the sum. */
  def load(value: SInt): Unit = base.choose(value)

  /** Puts a value into the sum, negated if the condition holds. */
  def loadSigned(value: SInt, negated: Bool = true.B): Unit = {
    addend.choose(value)
    subtracts.choose(negated.asSInt)
  }

  /** Puts a difference into the sum. */
  def loadDifference(from: SInt, by: SInt): Unit = add(from, by, subtract = true)

  private def add(from: SInt, by: SInt, subtract: Boolean = false): Unit = {
    base.choose(from)
    addend.choose(by)
    if (subtract) subtracts.choose((-1).S(1.W))
  }

  /** A sum or a difference of the small adder. */
  def combine(a: SInt, b: SInt, subtract: Boolean = false): SInt = {
    first.choose(a)
    second.choose(b)
    if (subtract) combineSubtracts.choose((-1).S(1.W))
    datapath.combined
  }

  /** The same, in [[lastCombined]] for the next step. */
  def combineForNext(a: SInt, b: SInt, subtract: Boolean = false): Unit = {
    val _ = combine(a, b, subtract)
  }

  /** Sets the shift of the datapath's shifted and saturated sums. */
  def setShift(amount: SInt): Unit = when(program.now) {
    datapath.shift.valid := true.B
    datapath.shift.bits  := amount
  }

  /** Latches the sum's exponent. */
  def latchExponent(): Unit = when(program.now)(datapath.latchExponent := true.B)

  /** Normalises the sum: the next step finds its f highest bits and its sign in [[shifted]]. */
  def normalise(): Unit = {
    latchExponent()
    setShift(sumExponent.zext)
  }

  /** Starts ⌊numerator · 2^f / denominator⌋. */
  def startDivision(numerator: UInt, denominator: UInt): Unit = {
    division(0).choose(numerator.zext)
    division(1).choose(denominator.zext)
  }

  /** In a step: repeats it until the quotient is ready, which stays until a step takes it. */
  def awaitDivision(exits: Exit[MarchLabel]*): Unit =
    program.branch(Repeat.until(hasQuotient, "quotient") +: exits: _*)

  /** In a step: the last one that uses the quotient; the divider is free in the next step. */
  def takeQuotient(): Unit = when(program.now)(datapath.takeQuotient := true.B)

  /** The numerator of a reciprocal ⌊2^(2f − 1) / mantissa⌋. */
  def one: UInt = (BigInt(1) << (f - 1)).U(f.W)

  def constant(value: BigInt): SInt = value.S((value.bitLength + 1).W)

  /** Makes the steps, and connects the datapath to the operands that they choose. */
  def build(): Unit = {
    program.build()
    datapath.multiply.valid       := wideFactor.isChosen
    datapath.multiply.bits.wide   := wideFactor.value
    datapath.multiply.bits.narrow := narrowFactor.value

    datapath.add.valid         := base.isChosen || addend.isChosen
    datapath.add.bits.base     := base.value
    datapath.add.bits.addend   := addend.value
    datapath.add.bits.subtract := subtracts.value =/= 0.S

    datapath.combine.valid         := first.isChosen
    datapath.combine.bits.base     := first.value
    datapath.combine.bits.addend   := second.value
    datapath.combine.bits.subtract := combineSubtracts.value =/= 0.S

    datapath.divide.valid            := division(0).isChosen
    datapath.divide.bits.numerator   := division(0).value.asUInt(f - 1, 0)
    datapath.divide.bits.denominator := division(1).value.asUInt(f - 1, 0)
  }
}

/** Labels of [[EnvironmentMarch]]'s program. */
sealed trait MarchLabel extends Label

object MarchLabel {
  case object Idle extends MarchLabel // waits for a ray

  // RayProjection: scales the direction, then projects origin and direction, one matrix row at a time
  case object ProjectOrigin extends MarchLabel
  case object OriginDepth   extends MarchLabel
  case object ProjectDir    extends MarchLabel
  case object UvwRay        extends MarchLabel

  // RayClip: moves the origin of a camera's ray into the maps' frustum, plane by plane
  case object ClipPlane   extends MarchLabel
  case object MovedOrigin extends MarchLabel
  case object Rate        extends MarchLabel

  // DdaSetup: distances to tile edges, one axis at a time
  case object FirstTile extends MarchLabel
  case object AxisSetup extends MarchLabel
  case object NextAxis  extends MarchLabel
  case object Centre    extends MarchLabel

  // TileProgram: from tile to tile
  case object Tile         extends MarchLabel
  case object NearestPlane extends MarchLabel
  case object TilePassed   extends MarchLabel

  // CellProgram: from cell to cell within a tile of several planes
  case object Cells       extends MarchLabel
  case object FirstCell   extends MarchLabel
  case object CellEdge    extends MarchLabel
  case object Cell        extends MarchLabel
  case object CellPassed  extends MarchLabel
  case object CellsPassed extends MarchLabel

  case object Plane extends MarchLabel // PlaneCache: finds or fetches a plane, and computes its depth along the ray

  // PlaneTest: compares the ray with a plane
  case object PlaneDepth  extends MarchLabel
  case object Behind      extends MarchLabel
  case object Emerge      extends MarchLabel
  case object PlanePassed extends MarchLabel
  case object Crosses     extends MarchLabel
  case object Meets       extends MarchLabel

  // HitResolver: the hit's pixel and distance, or the nearest bounding plane
  case object Hit                extends MarchLabel
  case object HitDistance        extends MarchLabel
  case object BoundingPlanes     extends MarchLabel
  case object BoundingPlane      extends MarchLabel
  case object BoundingDepth      extends MarchLabel
  case object NextBoundingPlane  extends MarchLabel
  case object BoundingPlanesDone extends MarchLabel

  case object Pixel  extends MarchLabel // HitPixel: projects a point of the ray to a pixel
  case object Finish extends MarchLabel // offers the hit
  case object Texel  extends MarchLabel // fetches albedo and normal of a bounding plane
}
