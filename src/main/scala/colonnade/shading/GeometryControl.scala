package colonnade.shading

import chisel3._
import chisel3.util.Valid
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Light

/** Control signals of the geometry datapath for one cycle. A register that no signal names keeps its value. */
final class GeometryControl(formats: ShaderFormats) extends Bundle {
  val load = Bool()

  // Multiplier operands: at most one of these
  val weightNormal  = Vec(3, Bool())
  val scaleShear    = Vec(2 * formats.shearDigits, Bool())
  val scaleOffset   = Bool()
  val square        = Bool()
  val squareNormal  = Bool()
  val projectNormal = Bool()
  val normProduct   = Bool()

  // The sum of products. `startSum` takes the first one; with `shiftAccumulator` the sum moves down by a digit before
  val accumulate       = Bool()
  val startSum         = Bool()
  val shiftAccumulator = Bool()

  val roundShear = Bool() // round the sum of a shear factor's digits; otherwise a normal's component

  // The adder: at most one of these
  val addShear      = Bool()
  val addDistance   = Bool()
  val addOffset     = Bool()
  val shiftInNormal = Bool()
  val shiftInLight  = Bool()
  val measureLight  = Bool()

  /** Rotates the point from the ray's frame to the object's: if the dominant axis is not z, and if it is x. */
  val unpermute = Vec(2, Bool())

  // The shifter: at most one of these
  val alignLight  = Vec(3, Bool())
  val scaleNormal = Bool()
  val scaleLight  = Bool()

  // The largest magnitude of a vector's components
  val startMeasure     = Bool()
  val latchNormalZeros = Bool()
  val latchLightZeros  = Bool()

  // Results
  val latchNormalLength = Bool()
  val latchDot          = Bool()

  /** Signals that choose the multiplier's operands. */
  def products: Seq[Bool] =
    weightNormal ++ scaleShear ++ Seq(scaleOffset, square, squareNormal, projectNormal, normProduct)

  /** Signals that choose the adder's operands. */
  def additions: Seq[Bool] = Seq(addShear, addDistance, addOffset, shiftInNormal, shiftInLight, measureLight)

  /** Signals that choose the shifter's operand. */
  def shifts: Seq[Bool] = alignLight ++ Seq(scaleNormal, scaleLight)
}

final class GeometryDatapathIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val control       = Input(new GeometryControl(formats))
  val request       = Input(new ShadeRequest(config))
  val isEnvironment = Input(Bool()) // load `environment` instead of `request`
  val environment   = if (config.device.hasEnvironment) Some(Input(new EnvironmentSurface(config))) else None
  val isFlat        = Input(Bool()) // shade with the geometric normal
  val light         = Input(new Light(numbers))
  val offset        = Input(UInt((numbers.gridBits - 2).W))
  val unitShift     = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))

  /** To the multiplier, whose product comes in the next cycle. */
  val operands = Valid(new MultiplierOperands(formats))
  val product  = Input(SInt(formats.productBits.W))

  val normalIsZero = Output(Bool()) // in the step that latches the normal's leading zeros: the normal is zero

  // Results for the current light
  val angle   = Output(new Angle(formats))
  val falloff = Output(new FalloffRequest(numbers))
  val surface = Output(new ShadedSurface(config))
}
