package colonnade.traversal

import chisel3._
import chisel3.util.{log2Ceil, RegEnable, UIntToOH}
import colonnade.config.{NumberFormats, TraversalConfig}
import colonnade.numbers.Rounding

/** Factors of a child's planes, one cycle after the node's operands. t is as in docs/numbers.md, section 3. */
final class PlaneSteps(numbers: NumberFormats) extends Bundle {

  /** By axis x', y': t from one plane to the next, rounded down and up. */
  val down = Vec(2, UInt((numbers.stepFraction + 1).W))
  val up   = Vec(2, UInt((numbers.stepFraction + 2).W))

  /** The pad along z', in the node's t. */
  val pad = UInt((numbers.boxPadLog + numbers.nearFraction + 1).W)
}

/** Summands of a child's products, two cycles after the node's operands. */
final class NodeTerms(numbers: NumberFormats) extends Bundle {

  /** By axis x', y': t at the node's first plane, for near and for far planes. */
  val near = Vec(2, SInt((numbers.nodeBits + 1).W))
  val far  = Vec(2, SInt((numbers.nodeBits + 1).W))

  /** Right shift that turns 2^(nearBits - 1) times a sum into t; see [[SaturatingShift]]. */
  val shiftRight = Vec(2, UInt(NodeStage.shiftBits(numbers).W))

  /** t of the ray's origin and of its tMax. */
  val origin = SInt(numbers.nearBits.W)
  val tMax   = SInt(numbers.nearBits.W)
}

final class NodeStageIO(config: TraversalConfig) extends Bundle {
  private val numbers = config.numbers

  val node = Input(new NodeOperands(config))

  /** Enables of the first and the second registers. */
  val isValid = Input(Vec(2, Bool()))
  val steps   = Output(new PlaneSteps(numbers))
  val terms   = Output(new NodeTerms(numbers))

  /** With `terms`: units from the node's first z' plane to the ray's origin, along the ray. */
  val toOrigin = Output(SInt(numbers.boxDistanceBits.W))
}

/** Where a ray meets the first planes of a node, relative to its first z' plane; docs/numbers.md, section 3.
  *
  * A pipeline of two cycles without stalls. The first one multiplies corner and reciprocal of each axis. The second one
  * subtracts the distance of the first z' plane, and shifts to the scale in which the planes of the children are
  * multiples of a short reciprocal.
  */
final class NodeStage(config: TraversalConfig) extends Module {
  val io = IO(new NodeStageIO(config))

  private val numbers  = config.numbers
  private val node     = io.node
  private val maxPlane = (BigInt(1) << numbers.boxBits) - 1

  // First cycle: the way from the node's first z' plane, which is its last one if z is negative, to the origin
  private val span         = Rounding.narrow((maxPlane.U << node.exponent(2)).zext, numbers.vertexBits + 2)
  private val away         = Mux(node.negative(2), node.corner(2), ~node.corner(2))
  private val toOrigin     = Rounding.narrow(away +& Mux(node.negative(2), span, 1.S), numbers.boxDistanceBits)
  private val toTMaxNext   = RegEnable(toOrigin +& node.tMax, io.isValid(0))
  private val toOriginNext = RegEnable(toOrigin, io.isValid(0))
  private val exponent     = RegEnable(node.exponent, io.isValid(0))
  private val negative     = RegEnable(node.negative, io.isValid(0))

  // The products, and the distance to add to them. The sum of a negative axis is complemented, which negates and floors
  private val zeroBits = numbers.reciprocalFraction - numbers.reciprocalDigits
  private val products = Seq.tabulate(2) { axis =>
    RegEnable(node.corner(axis) * node.reciprocal(axis).zext, io.isValid(0))
  }
  private val addends = Seq.tabulate(2) { axis =>
    val shifted = (toOrigin << node.shiftRight(axis)).asSInt
    val width   = numbers.boxDistanceBits + numbers.reciprocalFraction
    RegEnable(Rounding.narrow(Mux(node.negative(axis), ~shifted, shifted), width), io.isValid(0))
  }

  // The scale of each axis is its own, or a fraction of the planes of z' if that is coarser: by how much, and the right
  // shift from it to t
  private val scales = Seq.tabulate(2) { axis =>
    val own =
      node.exponent(axis).zext -& node.shiftRight(axis).zext +& (numbers.reciprocalFraction - numbers.stepFraction).S
    val lowest = node.exponent(2).zext - numbers.stepReach.S
    val isFine = own < lowest
    val coarse = Mux(isFine, (lowest -& own).asUInt, 0.U)
    val most   = (numbers.nearBits - 1).S
    val right  = most +& (node.exponent(2).zext -& numbers.nearFraction.S) -& Mux(isFine, lowest, own)
    (coarse, Mux(right < 0.S, 0.U, right.asUInt))
  }
  private val steps      = Reg(new PlaneSteps(numbers))
  private val shiftRight = Seq.tabulate(2) { axis =>
    RegEnable(Rounding.narrow(scales(axis)._2, NodeStage.shiftBits(numbers)), io.isValid(0))
  }
  private val drop = Seq.tabulate(2) { axis =>
    RegEnable(Rounding.narrow(node.exponent(axis) +& scales(axis)._1, NodeStage.dropBits(numbers)), io.isValid(0))
  }
  when(io.isValid(0)) {
    for (axis <- 0 until 2) {
      val whole = numbers.reciprocalDigits - numbers.stepFraction
      val short = if (whole >= 0) node.reciprocal(axis) >> whole else (node.reciprocal(axis) << -whole).asUInt
      val step  = Rounding.narrow(short >> scales(axis)._1, numbers.stepFraction + 1)
      steps.down(axis) := step
      steps.up(axis)   := step +& 1.U
    }
    val padBits = numbers.boxPadLog + numbers.nearFraction
    steps.pad := VecInit(Seq.tabulate(1 << node.exponent(2).getWidth)(e => (BigInt(1) << (padBits - e).max(0)).U))(
      node.exponent(2)
    )
  }
  io.steps := steps

  // Second cycle: the sum in the scale of the steps, widened by the pad. A negative axis begins at its last plane.
  private val terms = Reg(new NodeTerms(numbers))
  when(io.isValid(1)) {
    for (axis <- 0 until 2) {
      val exact   = (products(axis) << zeroBits).asSInt +& addends(axis)
      val shifted = Rounding.floor(exact, numbers.reciprocalFraction - numbers.stepFraction) >> drop(axis)
      val limited = Rounding.saturate(shifted, numbers.nodeBits)
      val base    = Mux(negative(axis), ~limited, limited)

      val (down, up)               = (steps.down(axis), steps.up(axis))
      val pad                      = ((up << numbers.boxPadLog) >> exponent(axis)).asUInt
      def across(step: UInt): UInt = Mux(negative(axis), (step << numbers.boxBits) -% step, 0.U)
      val roundsUp = Mux(shiftRight(axis) > (numbers.nearBits - 1).U, shiftRight(axis) - (numbers.nearBits - 1).U, 0.U)
      val ceiling  = UIntToOH(roundsUp, numbers.stepReach - numbers.nearFraction + 1)
      val nearOffset = ~pad.zext -& across(up).zext
      val farOffset  = (pad +& 1.U +& ceiling).zext -& across(down).zext
      terms.near(axis)       := Rounding.narrow(base +& nearOffset, numbers.nodeBits + 1)
      terms.far(axis)        := Rounding.narrow(base +& farOffset, numbers.nodeBits + 1)
      terms.shiftRight(axis) := shiftRight(axis)
    }
    terms.origin := inNode(toOriginNext)
    terms.tMax   := inNode(toTMaxNext)
  }
  io.terms    := terms
  io.toOrigin := RegEnable(toOriginNext, io.isValid(1))

  /** Units to the node's t, rounded down and saturated. */
  private def inNode(units: SInt): SInt =
    Rounding.saturate((units << numbers.nearFraction).asSInt >> exponent(2), numbers.nearBits)
}

object NodeStage {

  /** Width of the right shift of a sum; see [[NodeTerms]]. */
  def shiftBits(numbers: NumberFormats): Int =
    log2Ceil(numbers.nearBits - 1 + numbers.stepReach - numbers.nearFraction + 1)

  /** Width of the right shift of a product to the scale of the steps. */
  private def dropBits(numbers: NumberFormats): Int = NumberFormats.bitLength(numbers.maxExponent)
}
