package colonnade.ray

import chisel3._
import chisel3.util.{Cat, Valid}
import colonnade.common.Context
import colonnade.config.PathConfig
import colonnade.formats.InstanceNumber
import colonnade.numbers.{Fixed, Normalise, Rounding}

/** A ray in its own frame that waits for its entry into the object's box. */
final class AdvancingRay(config: PathConfig) extends Bundle {
  private val formats = new RayFormats(config.numbers)

  val context     = Context(config)
  val isShadow    = Bool()
  val orientation = new RayOrientation
  val exponent    = Vec(2, UInt(formats.exponentBits.W))
  val origin      = Vec(3, new Fixed(formats.scene))
  val tMax        = UInt((config.numbers.sceneBits + 1).W)
  val limits      = QueryBits(config)(new RayLimits(config.numbers))
  val visit       = InstanceNumber(config.device).map(Valid(_))
}

final class AdvanceStagesIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val loads = Input(Vec(new SetupStages(numbers).count, Bool()))

  /** In [[SetupStages.fetchedRay]]: the bits by which a shear factor is shorter than its quotient. */
  val exponents = Input(Vec(2, UInt(Normalise.exponentBits(numbers.directionBits).W)))

  /** In [[SetupStages.shearQuotients]], [[SetupStages.reciprocals]] and [[SetupStages.operands]]. */
  val shearQuotients = Input(Vec(2, UInt((numbers.shearDigits + 1).W)))
  val reciprocals    = Input(Vec(2, UInt(new RayFormats(numbers).reciprocal.width.W)))
  val tNear          = Input(UInt(numbers.entryBits.W))

  /** In [[SetupStages.advances]]. */
  val ray    = Input(new AdvancingRay(config))
  val enters = Input(Bool())

  val output = Output(new PreparedRay(config)) // in [[SetupStages.preparedRay]]
}

/** Scales the shear factors and moves a ray's origin to its entry into the box: a ray a cycle, all axes in parallel.
  *
  * A shear factor is a magnitude here, and its sign its component's: rounding to nearest even is symmetric. Source:
  * docs/numbers.md, sections 2.3, 2.4 and 2.7.
  */
final class AdvanceStages(config: PathConfig) extends Module {
  private val numbers  = config.numbers
  private val formats  = new RayFormats(numbers)
  private val stages   = new SetupStages(numbers)
  private val fraction = numbers.gridFraction

  val io                = IO(new AdvanceStagesIO(config))
  private val registers = new StageRegisters(io.loads)
  import registers.{hold, load}

  // Shear factors
  private val beforeShears = stages.shears - 1
  private val shears       = io.shearQuotients.zip(io.exponents).map { case (quotient, exponent) =>
    val shorter = hold(load(exponent, stages.unitOrigins), stages.unitOrigins, beforeShears)
    val scaled  = hold(quotient, stages.shearQuotients, beforeShears) << (numbers.shearFraction - numbers.shearDigits)
    hold(load(scaled >> shorter, stages.shears), stages.shears, stages.operands)
  }

  // The entry in grid steps, if they are longer than a unit; its products with the shear factors
  private val steps      = io.tNear >> (-fraction).max(0)
  private val entrySteps = load(steps, stages.advances)
  private val products   = shears.map(shear => load(shear * steps, stages.advances))

  // The advance
  private val isNegative = io.ray.orientation.negative
  private val along      = entrySteps << fraction.max(0)
  private val moved      = {
    val sideways = products.map(roundedDown)
    val amounts  = sideways :+ ((along, false.B))
    io.ray.origin.zip(isNegative).zip(amounts).map { case ((from, negative), (amount, roundsUp)) =>
      // Minus an amount that is rounded up is its complement, without the carry
      val amountAlong = Mux(negative, ~amount.zext, amount.zext)
      inReach(addWithCarry(from.integer, amountAlong, negative =/= roundsUp))
    }
  }

  private val prepared = Wire(new PreparedRay(config))
  prepared.root.foreach(_ := DontCare)
  prepared.visit.zip(io.ray.visit).foreach { case (to, from) => to := from }
  prepared.context         := io.ray.context
  prepared.isShadow        := io.ray.isShadow
  prepared.enters          := io.enters
  prepared.ray.orientation := io.ray.orientation
  prepared.ray.exponent    := io.ray.exponent
  prepared.ray.origin.zip(moved).foreach { case (to, from) => to := Fixed(formats.grid, from) }
  prepared.ray.shear.zip(shears).zip(isNegative).foreach { case ((to, magnitude), negative) =>
    val shear = hold(magnitude, stages.operands, stages.advances).zext
    to := Fixed(formats.shear, Mux(negative, 0.S -% shear, shear))
  }
  prepared.ray.reciprocal.zip(io.reciprocals).foreach { case (to, from) =>
    to := Fixed(formats.reciprocal, hold(from, stages.reciprocals, stages.advances))
  }
  prepared.tEntry := Fixed(formats.entry, entrySteps << (-fraction).max(0))
  prepared.tMax   := Fixed(formats.grid, Rounding.saturate(io.ray.tMax.zext -& along.zext, 0, formats.grid.highest))
  for (limits <- prepared.limits; requested <- io.ray.limits) {
    limits.filter := requested.filter
    limits.tMin   := Mux(requested.tMin > along, requested.tMin - along, 0.U)
  }
  io.output := load(prepared, stages.preparedRay)

  /** A product in grid steps, towards 0, and whether the nearest one is the next. */
  private def roundedDown(product: UInt): (UInt, Bool) = {
    val bits    = if (fraction < 0) numbers.shearFraction else numbers.vertexBits + 1
    val rounded = Rounding.floor(product, bits)
    (rounded, product(bits - 1) && (rounded(0) || product(bits - 2, 0).orR))
  }

  private def addWithCarry(a: SInt, b: SInt, carry: Bool): SInt =
    ((Cat(a, true.B).asSInt +& Cat(b, carry).asSInt) >> 1).asSInt

  /** The nearest position within half a cube around the object's cube. */
  private def inReach(position: SInt): SInt = {
    val halfLog = numbers.vertexBits - 1 + fraction
    val halves  = position >> halfLog
    val half    = BigInt(1) << halfLog
    val limited = Mux(halves < -1.S, (-half).S, Mux(halves >= 3.S, (3 * half).S, position))
    Rounding.narrow(limited, numbers.gridBits)
  }
}
