package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Enum, OHToUInt}
import colonnade.formats.{Plane, ShellEntry}

/** The planes that a ray has looked at: the last four stay, as depths along it. */
final class MarchPlanes(
    m:       MarchDatapath,
    channel: AttributeChannel[PlaneQuestion, ShellEntry]
) {
  import m.formats._
  import m.program._

  /** What a plane's depth is wanted for: it decides where the program goes on. */
  val Seq(forTile, forSurvey, forKeeping, forCell, forShell, forPixel) = Enum(6)
  val purpose                                                          = Reg(UInt(3.W))

  /** The plane that is wanted. */
  val id: UInt = Reg(UInt(layout.planeIdBits.W))

  private val slots    = Reg(Vec(4, new PlaneDepth(m.formats)))
  private val isKnown  = RegInit(VecInit.fill(4)(false.B))
  private val oldest   = RegInit(0.U(2.W))
  private val chosen   = Reg(UInt(2.W))
  private val plane    = Reg(new Plane)
  private val raised   = Reg(SInt((placeBits + planeFraction - f).W))
  private val partial  = Reg(SInt(valueBits.W))
  private val matches  = VecInit(slots.zip(isKnown).map { case (slot, known) => known && slot.id === id })
  private val question = channel.question

  /** The one that was wanted, once it is found. */
  val depth: PlaneDepth = slots(chosen)

  question.valid                := false.B
  question.bits.tag             := 0.U
  question.bits.content.isShell := purpose === forShell
  question.bits.content.index   := id

  /** In a step: of another ray none is known. */
  def forget(): Unit = isKnown.foreach(set(_, false.B))

  /** In a step: asks for an entry of the shell as a whole. */
  def askShell(index: UInt, condition: Bool): Unit = when(now && condition) {
    question.valid                := true.B
    question.bits.content.isShell := true.B
    question.bits.content.index   := index
  }

  /** Steps from the label "plane" on. They end at "depth", "seen depth", or "shell depth" with the shell's products in
    * the sum.
    */
  def describe(): Unit = {
    step("plane") {
      val isFound = matches.asUInt.orR && purpose =/= forShell
      when(now)(question.valid := !isFound)
      set(chosen, OHToUInt(matches))
      awaitOr(question.ready, (isFound && purpose === forKeeping) -> "keep", isFound -> "depth")
    }
    step {
      set(plane, channel.answer.bits.content.plane)
      set(chosen, oldest)
      await(channel.answer.valid)
    }
    step {
      m.multiply(m.place(0), plane.a)
      set(oldest, oldest + 1.U)
      set(isKnown(chosen), true.B)
      set(depth.id, id)
      set(depth.exponent, plane.exponent)
    }
    step {
      m.multiply(m.place(1), plane.b)
      m.load(m.product)
    }
    step {
      m.multiply(m.way(0), plane.a)
      m.accumulate()
      raise(m.place(2))
    }
    step {
      m.multiply(m.way(1), plane.b)
      m.load(m.product)
      set(partial, m.combine(raised, sumShare, subtract = true))
    }
    step {
      m.multiply(m.towards(2), plane.c) // for the shell
      m.accumulate()
      set(depth.value, m.combine(partial, plane.c, subtract = true))
      raise(m.way(2))
    }
    step {
      m.accumulate()
      set(depth.slope, m.combine(raised, sumShare, subtract = true))
      branch(
        (purpose === forShell)   -> "shell depth",
        (purpose === forPixel)   -> "seen depth",
        (purpose === forKeeping) -> "keep",
        true.B                   -> "depth"
      )
    }
  }

  private def sumShare: SInt = (m.sum >> f).asSInt

  /** A step of w has 2^(22 − f − exponent) steps of the plane. */
  private def raise(w: SInt): Unit = set(raised, (Cat(w, 0.U((planeFraction - f).W)).asSInt >> plane.exponent).asSInt)
}
