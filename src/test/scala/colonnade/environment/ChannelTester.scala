package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Valid}
import chiseltest._

import scala.collection.mutable
import scala.util.Random

/** A channel as one integer each way: the tag is in the low bits, an answer's `isIllegal` in the highest one. */
final class FlatChannel(questionBits: Int, answerBits: Int, tagBits: Int) extends Bundle {
  val question = Flipped(Decoupled(UInt((questionBits + tagBits).W)))
  val answer   = Valid(UInt((answerBits + tagBits).W))
}

object FlatChannel {

  /** Ports for a channel of the unit under test. */
  def apply[Q <: Data, A <: Data](channel: AttributeChannel[Q, A]): FlatChannel = {
    val (question, answer) = (channel.question.bits, channel.answer.bits)
    val flat               =
      IO(new FlatChannel(question.content.getWidth, answer.getWidth - answer.tag.getWidth, question.tag.getWidth))
    channel.question.valid := flat.question.valid
    channel.question.bits  := flat.question.bits.asTypeOf(question)
    flat.question.ready    := channel.question.ready
    flat.answer.valid      := channel.answer.valid
    flat.answer.bits       := answer.asUInt
    flat
  }
}

/** A packed question, its answer, and the bits of the answer that say something. */
final case class Exchange(question: BigInt, answer: BigInt, mask: BigInt = -1)

/** Asks a channel in random cycles and holds each answer, in the order of the questions, against the expected one.
  *
  * @param offered  probability that a question is offered in a cycle; while there is none the port is noise
  */
final class ChannelTester(
    name:     String,
    channel:  FlatChannel,
    tagBits:  Int,
    dialogue: Seq[Exchange],
    offered:  Double,
    random:   Random
) {
  private val toAsk   = mutable.Queue.from(dialogue)
  private val awaited = mutable.Queue.empty[(Exchange, Int)] // with the cycle of the question
  private var offer   = Option.empty[Exchange]               // with its tag

  /** Questions accepted, and answers. */
  var asked    = 0
  var answered = 0

  /** Least cycles from a question accepted to its answer. */
  var latency = Int.MaxValue

  private var cycle = 0

  def isDone: Boolean = answered == dialogue.size

  def before(): Unit = {
    if (offer.isEmpty && toAsk.nonEmpty && random.nextDouble() < offered) offer = Some(tagged(toAsk.dequeue()))
    channel.question.valid.poke(offer.nonEmpty)
    channel.question.bits.poke(offer.fold(BigInt(channel.question.bits.getWidth, random))(_.question))
  }

  def after(): Unit = {
    if (channel.answer.valid.peekBoolean()) {
      assert(awaited.nonEmpty, s"$name answers without a question")
      answered += 1
      val found               = channel.answer.bits.peekInt()
      val (expected, askedAt) = awaited.dequeue()
      latency = latency.min(cycle - askedAt)
      assert(
        (found & expected.mask) == (expected.answer & expected.mask),
        s"$name: answer $answered is ${found.toString(16)}, not ${expected.answer.toString(16)}"
      )
    }
    for (exchange <- offer if channel.question.ready.peekBoolean()) {
      asked += 1
      awaited += exchange -> cycle
      offer = None
    }
    cycle += 1
  }

  private def tagged(exchange: Exchange): Exchange = {
    val tag = BigInt(tagBits, random)
    Exchange(
      exchange.question << tagBits | tag,
      exchange.answer << tagBits | tag,
      exchange.mask << tagBits | ((BigInt(1) << tagBits) - 1)
    )
  }
}

object ChannelTester {

  /** Steps until all have their answers, and some cycles more, in which there may be no other ones.
    *
    * @param watch  called in each cycle
    * @return cycles up to the last answer
    */
  def run(clock: Clock, testers: Seq[ChannelTester], watch: () => Unit = () => ()): Int = {
    var cycles, quiet = 0
    def step(): Unit  = {
      val before = testers.map(_.answered).sum
      testers.foreach(_.before())
      testers.foreach(_.after())
      watch()
      clock.step()
      cycles += 1
      quiet = if (testers.map(_.answered).sum == before) quiet + 1 else 0
      assert(quiet < 200, "no answer any more")
    }
    clock.setTimeout(0)
    while (!testers.forall(_.isDone)) step()
    val last = cycles
    for (_ <- 0 until 20) step()
    last
  }
}
