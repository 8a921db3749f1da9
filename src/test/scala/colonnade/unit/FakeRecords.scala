package colonnade.unit

import chisel3.util.{DecoupledIO, Valid}
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordBroadcast, RecordRequest}

import scala.collection.mutable
import scala.util.Random

/** The records of a scene, by banks of random latency, which read a record once for all who ask for it while it is read.
  *
  * @param firstRow row of the first one of the requests
  */
final class FakeRecords(
    config:     ColonnadeConfig,
    requests:   Seq[DecoupledIO[RecordRequest]],
    firstRow:   Int,
    broadcasts: Seq[Valid[RecordBroadcast]],
    records:    Seq[BigInt],
    random:     Random
) {
  private case class Read(due: Int, address: Int, row: Int)
  private val inFlight = broadcasts.map(_ => mutable.Queue.empty[Read])
  private var now      = 0

  /** @param willing probability that a bank accepts a request in a cycle */
  def cycle(willing: Double): Unit = {
    for ((port, reads) <- broadcasts.zip(inFlight)) {
      val due = reads.headOption.filter(_.due <= now)
      port.valid.poke(due.nonEmpty)
      for (read <- due) {
        port.bits.address.poke(read.address)
        port.bits.record.poke(records(read.address))
        port.bits.row.poke(read.row)
        reads.dequeue()
      }
    }
    val asking = requests.zipWithIndex.collect {
      case (port, index) if port.valid.peekBoolean() => index -> port.bits.address.peekInt().toInt
    }
    requests.foreach(_.ready.poke(false))
    for ((reads, bank) <- inFlight.zipWithIndex if random.nextDouble() < willing) {
      val isRead = reads.map(_.address).filter(_ => config.columnBvhMemory.snooping).toSet
      val ours   = asking.filter { case (_, address) => address % inFlight.size == bank && !isRead(address) }
      if (ours.nonEmpty) {
        val (index, address) = ours(random.nextInt(ours.size))
        requests(index).ready.poke(true)
        reads.enqueue(Read(now + 1 + random.nextInt(6), address, firstRow + index))
      }
    }
    now += 1
  }
}
