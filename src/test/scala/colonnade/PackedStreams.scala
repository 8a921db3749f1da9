package colonnade

import chisel3._
import chisel3.util.{Decoupled, DecoupledIO}
import chiseltest._
import colonnade.formats.Layout

import scala.util.Random

/** Packs a payload's numbers, given by name, into bits, and unpacks them. */
final class Packed(payload: Data) {
  private val fields = Layout.of(payload)

  val width: Int = payload.getWidth

  def pack(values: Map[String, BigInt]): BigInt = {
    val unknown = values.keySet -- fields.map(_.name)
    require(unknown.isEmpty, s"no fields ${unknown.mkString(", ")}")
    fields.map { field =>
      val value = values.getOrElse(field.name, BigInt(0))
      val low   = if (field.signed) -(BigInt(1) << (field.width - 1)) else BigInt(0)
      require(value >= low && value < low + (BigInt(1) << field.width), s"${field.name} is $value")
      (value & ((BigInt(1) << field.width) - 1)) << field.offset
    }.sum
  }

  def unpack(bits: BigInt): Map[String, BigInt] = fields.map { field =>
    val value = (bits >> field.offset) & ((BigInt(1) << field.width) - 1)
    field.name -> (if (field.signed && value.testBit(field.width - 1)) value - (BigInt(1) << field.width) else value)
  }.toMap
}

/** A unit with one integer per stream, so that a test pokes and peeks once per cycle. */
abstract class PackedUnit[I <: Data, O <: Data](input: I, output: O) extends Module {
  val in  = IO(Flipped(Decoupled(UInt(input.getWidth.W))))
  val out = IO(Decoupled(UInt(output.getWidth.W)))

  protected def connect(unitIn: DecoupledIO[I], unitOut: DecoupledIO[O]): Unit = {
    unitIn.valid  := in.valid
    unitIn.bits   := in.bits.asTypeOf(input)
    in.ready      := unitIn.ready
    out.valid     := unitOut.valid
    out.bits      := unitOut.bits.asUInt
    unitOut.ready := out.ready
  }
}

object PackedStreams {

  /** Sends all payloads with random bubbles and accepts as many results with random stalls. The input is random while
    * no payload is offered.
    *
    * @param offered  probability that the next payload is offered in a cycle
    * @param accepted probability that a result is accepted in a cycle
    * @return results, and the cycles from the first accepted input to the last result
    */
  def run(
      unit:     PackedUnit[_, _],
      payloads: Seq[BigInt],
      offered:  Double = 1,
      accepted: Double = 1,
      random:   Random = new Random(7)
  ): (Seq[BigInt], Int) = {
    val results = Seq.newBuilder[BigInt]
    var sent    = 0
    var taken   = 0
    var cycles  = 0
    var offers  = false
    var idle    = 0
    while (taken < payloads.size) {
      offers = sent < payloads.size && (offers || random.nextDouble() < offered)
      unit.in.valid.poke(offers.B)
      unit.in.bits.poke(if (offers) payloads(sent).U else BigInt(unit.in.bits.getWidth, random).U)
      val accepts = random.nextDouble() < accepted
      unit.out.ready.poke(accepts.B)
      idle += 1
      assert(idle < 1000, s"nothing happens after $sent inputs and $taken results")
      if (accepts && unit.out.valid.peekBoolean()) {
        results += unit.out.bits.peekInt()
        taken += 1
        idle = 0
      }
      if (sent > 0) cycles += 1
      if (offers && unit.in.ready.peekBoolean()) {
        sent += 1
        idle = 0
        offers = false
      }
      unit.clock.step()
    }
    unit.in.valid.poke(false.B)
    unit.out.ready.poke(true.B)
    for (_ <- 0 until 20) {
      unit.out.valid.expect(false.B, "more results than inputs")
      unit.clock.step()
    }
    (results.result(), cycles)
  }
}

/** Ports as a whole: all numbers of a bundle, in the order of its fields. */
object RandomPorts {

  /** Pokes each number of an input with any value of its width; gives the values. */
  def randomise(data: Data, random: Random): Seq[BigInt] = numbers(data).map { number =>
    val value = BigInt(number.getWidth, random)
    number match {
      case signed: SInt =>
        val least = BigInt(-1) << (signed.getWidth - 1)
        signed.poke(least + value)
        least + value
      case other =>
        other.asInstanceOf[UInt].poke(value)
        value
    }
  }

  def peek(data: Data): Seq[BigInt] = numbers(data).map {
    case number: SInt => number.peekInt()
    case number       => number.asInstanceOf[UInt].peekInt()
  }

  private def numbers(data: Data): Seq[Bits] = data match {
    case vec: Vec[_]    => vec.flatMap(element => numbers(element.asInstanceOf[Data]))
    case record: Record => record.elements.values.toSeq.reverse.flatMap(numbers)
    case number: Bits   => Seq(number)
    case other          => throw new IllegalArgumentException(s"a port of $other")
  }
}
