package colonnade.environment

import chisel3._
import chisel3.util.Cat
import colonnade.config.ColonnadeConfig
import colonnade.formats.Plane
import colonnade.numbers.{Divider, Normalise, Rounding}

/** A plane along a ray: how far the ray is in front of it, value + slope · s, in steps of 2^(exponent − 22). */
final class PlaneDepth(formats: MarchFormats) extends Bundle {
  val id       = UInt(formats.layout.planeIdBits.W)
  val value    = SInt(formats.valueBits.W)
  val slope    = SInt(formats.slopeBits.W)
  val exponent = UInt((new Plane).exponent.getWidth.W)
}

/** What the parts of the march's program share: one multiplier, the sum behind it, a smaller adder, one shifter and one
  * divider. A product of one step is there to add in the next, its sum in the one after.
  */
final class MarchDatapath(config: ColonnadeConfig, val program: Microprogram) {
  val formats = new MarchFormats(config)
  import formats._

  // The ray
  /** Its direction, as long as f bits hold. */
  val heading: Vec[SInt] = Reg(Vec(3, SInt((f + 1).W)))

  /** The origin's projection; then u and v from the map's middle, and w. */
  val place: Vec[SInt] = Reg(Vec(3, SInt(placeBits.W)))

  /** The direction's projection. */
  val towards: Vec[SInt] = Reg(Vec(3, SInt((f + 1).W)))

  /** The direction in (u, v, w); for the shell, the direction's projection from the map's middle. */
  val way:        Vec[SInt] = Reg(Vec(3, SInt(directionBits.W)))
  val placeTop:   UInt      = Reg(UInt(lengthBits.W))
  val towardsTop: UInt      = Reg(UInt(lengthBits.W))
  val wayTop:     UInt      = Reg(UInt(lengthBits.W))

  /** The origin's depth. */
  val depthMantissa: UInt = Reg(UInt(f.W))
  val depthLength:   UInt = Reg(UInt(lengthBits.W))

  // Scratch
  val axis:      UInt      = Reg(UInt(2.W))
  val lengths:   Vec[UInt] = Reg(Vec(3, UInt(lengthBits.W)))
  val length:    UInt      = Reg(UInt(lengthBits.W))
  val mantissa:  UInt      = Reg(UInt(f.W))
  val numerator: UInt      = Reg(UInt(f.W))
  val quotient:  UInt      = Reg(UInt((f + 1).W))

  /** How far the sum is shifted down, from f bits higher up. */
  val drop: SInt = Reg(SInt(exponentBits.W))

  val product: SInt = Reg(SInt(productBits.W))
  val sum:     SInt = Reg(SInt(sumBits.W))

  private val wideFactor       = new Operand(program, wideBits)
  private val narrowFactor     = new Operand(program, narrowBits)
  private val base, addend     = new Operand(program, sumBits)
  private val first, second    = new Operand(program, combineBits)
  private val subtracts        = new Operand(program, 1)
  private val combineSubtracts = new Operand(program, 1)
  private val division         = Seq.fill(2)(new Operand(program, f + 1))
  private val combined         = Wire(SInt(combineBits.W))
  private val divider          = Module(new Divider(f, f))
  divider.io.quotient.ready := false.B

  /** The product without its fraction. */
  val share: SInt = Rounding.floor(product, f)

  def multiply(wide: SInt, narrow: SInt): Unit = {
    wideFactor.choose(wide)
    narrowFactor.choose(narrow)
  }

  /** Adds the product to the sum, or subtracts it. */
  def accumulate(subtract: Boolean = false): Unit = add(sum, product, subtract)

  /** Adds the product to the sum that the digits before it make. */
  def descend(): Unit = add((sum << digitBits).asSInt, product)

  def load(value: SInt): Unit = base.choose(value)

  /** Turns the sum's sign. */
  def flip(condition: Bool): Unit = {
    addend.choose(Mux(condition, sum, 0.S))
    base.choose(Mux(condition, 0.S, sum))
    subtracts.choose(condition.asSInt)
  }

  private def add(from: SInt, by: SInt, subtract: Boolean = false): Unit = {
    base.choose(from)
    addend.choose(by)
    if (subtract) subtracts.choose((-1).S(1.W))
  }

  /** A sum, or a difference, of the smaller adder; at most one in a step. */
  def combine(a: SInt, b: SInt, subtract: Boolean = false): SInt = {
    first.choose(a)
    second.choose(b)
    if (subtract) combineSubtracts.choose((-1).S(1.W))
    combined
  }

  /** The sum with f bits behind the point, dropped down. */
  private val dropBits = Normalise.exponentBits(sumBits + f)
  private val tooFar   = drop >= (sumBits + f).S
  private val by       = Mux(drop < 0.S, 0.U, Mux(tooFar, (sumBits + f).U, drop.asUInt))(dropBits - 1, 0)
  val shifted: SInt = Rounding.narrow(Cat(sum, 0.U(f.W)).asSInt >> by, scaledBits)

  /** The sum's bit length after that is more than `bits`. The sum is measured. */
  private def exceeds(bits: Int): Bool = sum =/= 0.S && (drop < 0.S || length.zext +& (f - bits).S > drop)

  /** The nearest number of so many bits and a sign. */
  def saturated(bits: Int): SInt = {
    val ends = Mux(sum < 0.S, (-(BigInt(1) << bits)).S((bits + 1).W), ((BigInt(1) << bits) - 1).S((bits + 1).W))
    Mux(exceeds(bits), ends, Rounding.narrow(shifted, bits + 1))
  }

  /** Without a sign, of a sum that is not negative. */
  def saturatedNatural(bits: Int): UInt =
    Mux(exceeds(bits), ((BigInt(1) << bits) - 1).U(bits.W), shifted.asUInt(bits - 1, 0))

  /** Bits of the sum without its sign. */
  val measured: UInt = Normalise.bitLength(Mux(sum < 0.S, ~sum, sum).asUInt).pad(lengthBits)

  /** In a step: measures the sum. The next step finds its f highest bits, beside the sign, in [[shifted]]. */
  def measure(): Unit = {
    program.set(length, measured)
    program.set(drop, measured.zext.pad(exponentBits))
  }

  /** In a step: begins ⌊numerator · 2^f / denominator⌋. One division at a time. */
  def startDivision(numerator: UInt, denominator: UInt): Unit = {
    division(0).choose(numerator.zext)
    division(1).choose(denominator.zext)
  }

  /** A step: the quotient is there after it. */
  def awaitDivision(): Unit = program.step {
    program.set(quotient, divider.io.quotient.bits)
    when(program.now)(divider.io.quotient.ready := true.B)
    program.await(divider.io.quotient.valid)
  }

  /** Two steps. */
  def divide(numerator: => UInt, denominator: => UInt): Unit = {
    program.step(startDivision(numerator, denominator))
    awaitDivision()
  }

  /** The value whose reciprocal is to be found is a mantissa: ⌊2^(2f − 1) / mantissa⌋. */
  def one: UInt = (BigInt(1) << (f - 1)).U(f.W)

  def constant(value: BigInt): SInt = value.S((value.bitLength + 1).W)

  /** Connects the units to what the program's steps chose. */
  def build(): Unit = {
    def sumOf(a: SInt, b: SInt, subtract: Bool, width: Int): SInt =
      Rounding.narrow(a + (b ^ Mux(subtract, (-1).S(width.W), 0.S(width.W))) + Cat(0.U(1.W), subtract).asSInt, width)

    when(wideFactor.isChosen)(product := wideFactor.value * narrowFactor.value)
    when(base.isChosen)(sum           := sumOf(base.value, addend.value, subtracts.value =/= 0.S, sumBits))
    combined := sumOf(first.value, second.value, combineSubtracts.value =/= 0.S, combineBits)

    divider.io.division.valid            := division(0).isChosen
    divider.io.division.bits.numerator   := division(0).value.asUInt(f - 1, 0)
    divider.io.division.bits.denominator := division(1).value.asUInt(f - 1, 0)
    assert(!divider.io.division.valid || divider.io.division.ready, "a division during another one")
  }
}
